"""What reproduces a paper or a comparison beyond its experiment file."""
