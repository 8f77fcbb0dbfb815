"""What reproduces a paper or a comparison beyond its file.

Read `study`, `known`, `tasks`, `run`, then a package for each study.
"""
