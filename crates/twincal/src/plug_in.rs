//! Noise weights, autocorrelation and slab scale by fixed-point iteration at the model-average residual.
