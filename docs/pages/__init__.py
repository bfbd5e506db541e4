"""Programs of the pages, by page; `python docs/make.py` lists and runs them."""
