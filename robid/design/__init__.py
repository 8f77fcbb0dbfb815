"""Design of experiments: `excitation/` is what the motors are told to do, `configurations/` where it is worth doing."""
