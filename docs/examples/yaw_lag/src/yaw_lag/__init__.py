"""A vehicle whose yaw rate lags behind its command."""
