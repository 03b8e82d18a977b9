"""How far a vehicle has flown."""
