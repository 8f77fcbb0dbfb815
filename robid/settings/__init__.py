"""The experiment and robot files: pydantic models, YAML loading, checks, JSON schema."""
