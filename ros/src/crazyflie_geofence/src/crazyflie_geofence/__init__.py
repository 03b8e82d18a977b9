"""A controller that keeps a vehicle in a box; see geofence.py, and docs/geofence_proof.md."""
