"""Files to begin with: `folders` makes them, `examples` takes them from those we have, `foreign` from a rigid model."""
