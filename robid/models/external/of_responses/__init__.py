"""External fits of campaigns that have responses alone: transfer functions, their judgement, files and page."""
