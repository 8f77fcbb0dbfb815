"""The study of gears with two encoders: what is found of them, and of gears that have worn."""
