"""A pole that is too near, or not."""
