"""Checks of a sequence before training: all faults in one pass, each finding with its remedy.

    kinds                       every kind of finding, with level, reason and remedy
    check, frame_pass           `endotsr check`: what follows from all frames, and the pass that reads them
    guard, loaded               the checks on frames that a training holds in memory
    written                     the checks on frames that `endotsr prepare` writes

    frames                      pictures of a clip, one after another; it calls the next nine
    clock_names, copies, exchanged, frame_order
                                names of pictures; repeated and exchanged frames, and those in another order
    colours, light, blurred, scenes, halves
                                other light and flicker, blurred frames, other scenes and views
    still_parts, dark_border    what stands still in pictures that move, and dark borders
    colour_planes               colour planes that are displaced against each other
    masks, held, polarity, specks
                                masks against their neighbours and the pictures, masks that stay, masks of noise
    depth, depth_rims, depth_wraps
                                values of the depth, depth interpolated across holes, and numbers that did not fit
    depth_steps, flips          depth against the motion and the light of the pictures
    depth_pair, stereo          depth against stereo pairs, and the two views of a pair
    late, displaced             masks and depth of other moments than their pictures; depth beside its masks
    cameras, agreement          poses and calibration, and whether the poses explain the pictures
    split_tissue                tissue on both sides of the split

A check that needs frames one after another is a class with `add` and `findings`: `frame_pass` keeps one, and `guard`
and `written` fill another from the frames that they have.
"""
