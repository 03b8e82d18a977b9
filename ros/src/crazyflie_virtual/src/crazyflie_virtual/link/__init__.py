"""The link to the client: CRTP packets in UDP datagrams, with their faults."""
