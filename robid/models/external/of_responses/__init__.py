"""External fits of campaigns that have responses alone: transfer functions, their judgement, files and page.

Read `solution`, what is found; `blocks`, `fitting`, `parameters` and `agreement`, how; then `judging`, `files`, `page`.
"""
