"""How a program ends while jobs run."""
import subprocess
import sys
import unittest

import alidade as al
from common import InFolder

#: Threads that a program does not wait for, each with a job that takes longer than the program. What it prints is its end.
DAEMONS = """
import atexit, sys, threading, time
atexit.register(print, "ended")  # after alidade's
import numpy as np
import alidade as al

def forever(job):
    while True:
        job()

camera, points = al.Camera.read("camera_1.yaml"), np.ones((300_000, 3))
rig = lambda **more: al.rig("views.csv", cameras=["camera_1.yaml", "camera_2.yaml"], board=al.Board("9x6", 0.025), **more)
work = {"job": rig, "many": rig, "progress": lambda: rig(progress=lambda *news: time.sleep(30)), "call": lambda: camera.project(points)}[sys.argv[1]]
for _ in range(3 if sys.argv[1] == "many" else 1):
    threading.Thread(target=forever, args=(work,), daemon=True).start()
time.sleep(float(sys.argv[2]))
"""
#: A job that is stopped and left behind, then a child that has none of its threads.
CHILD = """
import os, sys
import alidade as al
try:
    al.rig("views.csv", cameras=["camera_1.yaml", "camera_2.yaml"], board=al.Board("9x6", 0.025), progress=lambda *news: False)
except al.Interrupted:
    pass
child = os.fork()
if child == 0:
    sys.exit(3)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


class Ending(InFolder):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        al.simulate.rig().save(cls.folder)

    def python(self, code, *words):
        return subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, cwd=self.folder, timeout=60)

    def test_daemon_threads_at_work_are_stopped(self):
        """It was "FATAL: exception not rethrown", and a core dumped."""
        for what in ("job", "many", "progress", "call"):
            for seconds in ("0.1", "0.3"):
                with self.subTest(what=what, seconds=seconds):
                    done = self.python(DAEMONS, what, seconds)
                    self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "ended\n", ""))

    def test_a_forked_child_waits_for_no_thread_of_its_parent(self):
        done = self.python(CHILD)
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "3\n", ""))


if __name__ == "__main__":
    unittest.main()
