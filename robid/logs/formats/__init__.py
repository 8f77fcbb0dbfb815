"""Log files behind one mapping.

Read `load`, `variables`, `known`; `apart` and `worker`; `tables` with `telling`, `layout`, `cells` and `moments`; then
one format each, and the recorders' tables of text, which `recorders` lists.
"""
