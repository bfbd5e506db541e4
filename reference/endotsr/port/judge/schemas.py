"""The structures whose JSON Schema is in `golden/schemas`, by name."""

from endotsr.port.judge.certificate import Certificate
from endotsr.port.judge.format import Case, Manifest, Request, Requests

SCHEMAS = {"case": Case, "manifest": Manifest, "request": Request, "requests": Requests, "certificate": Certificate}
