"""External dynamics, as of Oliveira et al. (2019).

Read `bench`, `judging`, then the parts: `plants`, `seeds`, `arm`.
"""
