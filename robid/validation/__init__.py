"""What a model is worth. Read `doubt`, `grade`, `recovery`, `outcome`, then `elastic/`; the rest serves studies."""
