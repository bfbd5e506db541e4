"""Pictures, films and viewer pages of a trained scene.

cameras   camera paths: observed, orbit, sway, a file          plan      the views: times, cameras and names
panels    a view as a picture: render, truth, error, depth     pictures  a folder of PNG and NPY files
film      mp4, webm and gif files                              page      the interactive viewer page
preview   the animation of the report                          trajectories   quantised Gaussians at key times
draw_page the page on which masks of key frames are drawn

In: a model and the record of its sequence. Out: files.
"""
