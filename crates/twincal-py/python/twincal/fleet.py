"""Fleets: many logs of many robots.

======================  ==================================================================
`plan`                  how logs become statistics, from some logs of one robot
`statistics`            a folder or an object store of logs to a file of statistics per log
`fit`                   files of statistics to a `Fleet`: which robots deviate, since when
======================  ==================================================================
"""

from __future__ import annotations

from twincal._engine import FleetStatistics, statistics
from twincal._fleet import Fleet, fit, plan
from twincal._job import Fault, File

__all__ = ["Fault", "File", "Fleet", "FleetStatistics", "fit", "plan", "statistics"]
