"""Results: what a user asks of a trained scene.

In: a model and the record of its run. Out: numbers, pages, pictures, films and files for other programs. This storey
does not train.

evaluation metrics, baselines, protocols                 report     pages and text
export     files for other programs                      views      pictures, films, the viewer
"""
