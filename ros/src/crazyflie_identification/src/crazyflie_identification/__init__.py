"""The model of a vehicle from the bag of a flight: mass, thrust, delay, lags, drag and trims."""
