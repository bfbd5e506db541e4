"""From files to the frames of a training. Every error names file, frame and reason.

A recording becomes a `Clip`, which is read on demand, and the frames of a training a `Sequence` in memory.

    layouts                           one file for each kind of folder or file that is read
    source_options, sources           what a user states, and what layouts share
    stored_pairs, pairing             two views in one picture, and files of another program for each frame
    unread, unknown_source            what is not read, and what a path of no layout is
    clip, clip_pictures, view_frames  a clip, its pictures on demand, and its frames for the estimation of poses
    folder_reader, depth_files        files that training reads directly
    masks, mask_values, mask_videos, mask_polarity
                                      from mask files to tissue
    poses, points, crop               LLFF poses, depth from points, and the window of a cropped clip
    sequence_file                     `sequence.toml` of the common format
    read                              from a clip to a sequence; the next four are its steps
    frame_store, depth_outliers, world, smaller
                                      where arrays lie, outliers of depth, the unit and origin, a smaller size
    sequence, record                  a sequence in memory, and what a run keeps of it
    splits, times, sampling           selected and held-out frames, their times, and samples of frames and pixels
    field_of_view                     the part of the pictures that shows tissue
    checks                            what is wrong with a sequence
    forecast                          what its training will need
"""
