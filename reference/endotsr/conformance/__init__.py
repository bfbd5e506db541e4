"""The conformance target for ports: golden cases, their manifest and the judge."""
