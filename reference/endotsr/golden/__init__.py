"""The conformance target of ports: golden cases, the judge, wrong ports that the judge must refuse."""
