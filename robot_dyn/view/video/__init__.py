"""Videos of pages: an installed browser, without a window, shows the page at each time, and a picture is taken.

video.py     `Page.save_video`: checks, times of the frames, the file
browser.py   the Chrome, Chromium or Edge of this machine by Playwright: the page at times, as pictures
encoders.py  MP4 and GIF by ffmpeg
"""
