"""What reproduces a paper or a comparison beyond its file.

Read `study`, `page`, `experiments`, `simulated`, `run`, then `settings` and a package for each study.
"""
