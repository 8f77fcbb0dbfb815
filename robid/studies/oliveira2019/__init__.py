"""External dynamics, as of Oliveira et al. (2019).

Read `bench`, `judging`, `identification`, then the parts: `plants` with its `pictures`, `coverage`, `synthetic`, `arm`
with its `homes`.
"""
