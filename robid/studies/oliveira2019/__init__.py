"""The study of external dynamics of Oliveira et al. (2019)."""
