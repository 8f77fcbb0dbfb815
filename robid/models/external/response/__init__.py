"""Rational transfer functions fitted to measured frequency responses.

Read `data` and `options`; `lines`, `basis`, `denominator` and `residual`, the least-squares problem for given poles;
`starts` and `descent`, the search of poles; `orders` and `choice`, which structure; `improper`, whether zeros are
missing; `uncertainty`, `result`; `fitting` calls them all.

docs/methods, sec. 14, has the equations.
"""
