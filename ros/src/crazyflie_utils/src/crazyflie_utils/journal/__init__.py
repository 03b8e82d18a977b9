"""What a process was given, in order: written by a recorder, and read to run its nodes again."""
