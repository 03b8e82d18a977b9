"""Many vehicles by one file: what they are, and what all of them do together."""
