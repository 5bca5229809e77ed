"""What feedsim does, a function a job: files in, a result out. Python calls it, and so does the command of its name.

May use every room but the command line. A job prints nothing; who wants to see progress gives it a `Watch`.
Start with circle.py, the shortest; result.py is what every job returns.
"""
