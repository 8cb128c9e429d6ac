"""Videos of pages: an installed browser, without a window, shows the page at each time and takes its picture.

video.py      `Page.save_video`: what is checked, times of the frames, the file
installed.py  the Chrome, Chromium or Edge of this machine
browser.py    a browser as a context, driven by the DevTools protocol over two pipes
frames.py     the page at the times of the frames, as pictures
encoders.py   MP4 by ffmpeg, GIF by Pillow
"""
