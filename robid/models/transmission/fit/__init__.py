"""The fit of gears to records with encoders on both sides."""
