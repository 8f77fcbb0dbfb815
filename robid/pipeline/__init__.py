"""An experiment as stages.

Read `stage`, `chain` (the list), `plans` (what each reads and writes), then `graph` (what runs, and when); each stage
does its work in the module of its name.
"""
