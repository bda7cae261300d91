"""Fleets: many logs of many robots.

======================  ==================================================================
`statistics`            a folder or an object store of logs to a file of statistics per log
======================  ==================================================================
"""

from __future__ import annotations

from twincal._engine import FleetStatistics, statistics
from twincal._job import Fault, File

__all__ = ["Fault", "File", "FleetStatistics", "statistics"]
