"""The ports of CRTP: packets in, packets out."""
