"""What a trained scene looks like: cameras and times, panels side by side, folders of pictures, films.

cameras   camera paths: observed, orbit, sway, a file          plan      which times, cameras and names: the views
panels    a view as a picture: render, truth, error, depth     pictures  a folder of PNG and NPY files
film      mp4, webm and gif files                         page      the viewer page, drawn by the browser
trajectories   the moving Gaussians at key times, rounded, for the page

In: a model and the record of its sequence. Out: files. Nothing here trains or measures.
"""
