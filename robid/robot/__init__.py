"""The robot: description, elastic MuJoCo model, equilibrium and linearization."""
