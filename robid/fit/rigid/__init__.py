"""Rigid dynamics and friction by inverse-dynamics least squares. Read `base` first."""
