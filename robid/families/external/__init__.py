"""The external family: transfer functions from commands to positions."""
