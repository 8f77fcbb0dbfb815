"""Log files behind one mapping. Read `load`, `variables`, `known`; `apart` and `worker`; then one format each."""
