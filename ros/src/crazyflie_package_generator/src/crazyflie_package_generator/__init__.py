"""Makes packages that build, pass their tests and lint as they come."""
