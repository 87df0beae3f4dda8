"""The application: command line, pipeline, reports and previews."""

import os

# Matrices here have at most some hundred rows. Threads of BLAS gain nothing on them, and lose much where cores are
# busy; they are asked for before numpy is first imported, and whoever sets the variable keeps the say.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
