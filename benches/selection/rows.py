"""From a log to the rows that a regression sees, by NumPy and SciPy alone: the pipeline of `twincal`, written a second time.

One symmetric filter at `cutoff` on every column and on the torque, samples kept at `rate`; where only positions are
logged, derivatives of positions that were filtered at `motion_cutoff` first.
"""

import numpy as np
from scipy.signal import firwin, kaiser_beta, oaconvolve

TRANSITION = 0.3  # half the width of the filters' transition band, relative to the cut-off


def low_pass(cutoff, rate, attenuation):
    """Taps of a Kaiser-windowed sinc with its length rule, gain 1 at 0 Hz."""
    half = round((attenuation - 7.95) / (2.285 * 2 * np.pi * 2 * TRANSITION * cutoff) * rate / 2)
    return firwin(2 * half + 1, cutoff, fs=rate, window=("kaiser", kaiser_beta(attenuation)))


def derive(q, rate, motion_cutoff):
    """q, q̇, q̈ of filtered positions (samples x joints), and how many samples each end lost.

    80 dB: the filter's own ripple changes no torque that could be seen.
    """
    taps = low_pass(motion_cutoff, rate, 80.0)
    smooth = oaconvolve(q, taps[:, None], mode="valid", axes=0)
    first = np.gradient(smooth, 1 / rate, axis=0, edge_order=2)
    second = (smooth[2:] - 2 * smooth[1:-1] + smooth[:-2]) * rate**2
    return (smooth[1:-1], first[1:-1], second), len(taps) // 2 + 1


def filtered(columns, rate, cutoff, kept_rate):
    """Columns (samples x anything) through the filter at `cutoff`, then every sample of rate `kept_rate`."""
    flat = columns.reshape(len(columns), -1)
    smooth = oaconvolve(flat, low_pass(cutoff, rate, 50.0)[:, None], mode="valid", axes=0)
    return smooth[:: round(rate / kept_rate)].reshape(-1, *columns.shape[1:])
