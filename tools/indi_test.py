#!/usr/bin/env python3
"""`alidade head --calibrate` on a mount and a camera that others simulate: tools/indi_test.py ALIDADE [--runs 1]
INDI's telescope and camera simulators (Debian's indi-bin) show a sky of random stars, which a `gsc` of ours on their PATH lists:
200 mm and pixels of 5.2 um are f = 38461.54 px, stars are drawn at whole pixels. The mount's angles are exact, so that the
focal length has to be right within its sigma, and sigma what such pixels give: a few px. The mount's angles have aberration in
them and the images do not: 1e-4 of f times the cosine to where the Earth goes, 6e-5 RMS. Exit 77 where indi-bin is missing."""
import argparse
import json
import math
import os
import pathlib
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time

TRUTH_PX = 200.0 / 5.2e-3
CENTRE_DEG, RADIUS_DEG, STARS_A_SQUARE_DEGREE = (90.0, 20.0), 6.0, 25.0
ABERRATION = 6e-5
SIGMA_PX = (0.2, 8.0)  # 27 images of 30 stars at whole pixels: 1; 10 images: 3

# indiserver has no option for the address on which it listens.
LOOPBACK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <netinet/in.h>
#include <sys/socket.h>
int bind(int fd, const struct sockaddr *address, socklen_t size) {
  int (*real)(int, const struct sockaddr *, socklen_t) = dlsym(RTLD_NEXT, "bind");
  if (address->sa_family != AF_INET) return real(fd, address, size);
  struct sockaddr_in here = *(const struct sockaddr_in *)address;
  here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return real(fd, (struct sockaddr *)&here, size);
}
"""

# Asked by the camera's simulator: -c RA DEC -r ARCMIN -m BRIGHTEST FAINTEST -n MOST, degrees.
CATALOGUE = r"""#!/usr/bin/env python3
import math, pathlib, sys
def number(option, place): return float(sys.argv[sys.argv.index(option) + place])
ra, dec, reach = math.radians(number("-c", 1)), math.radians(number("-c", 2)), math.radians(number("-r", 1) / 60.0)
count = 0
for line in open(pathlib.Path(__file__).parent / "stars.txt"):
    name, r, d, magnitude = line.split()
    a, b = math.radians(float(r)), math.radians(float(d))
    near = math.sin(b) * math.sin(dec) + math.cos(b) * math.cos(dec) * math.cos(a - ra)
    if near < math.cos(reach) or float(magnitude) > number("-m", 2) or count >= number("-n", 1): continue
    count += 1
    print(f"{name} {float(r):.7f} {float(d):+.7f} 0.2 {magnitude} 0.4 0 0 PLAT F {60.0 * math.degrees(math.acos(min(1.0, near))):.2f} 0")
"""


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def write_sky(folder, seed):
    """Stars spread evenly about the centre, in degrees."""
    rng = random.Random(seed)
    ra0, dec0 = (math.radians(x) for x in CENTRE_DEG)
    count = int(STARS_A_SQUARE_DEGREE * 2.0 * math.pi * (1.0 - math.cos(math.radians(RADIUS_DEG))) * math.degrees(1.0) ** 2)
    with open(folder / "stars.txt", "w") as out:
        for i in range(count):
            away, turn = math.acos(rng.uniform(math.cos(math.radians(RADIUS_DEG)), 1.0)), rng.uniform(0.0, 2.0 * math.pi)
            dec = math.asin(math.sin(dec0) * math.cos(away) + math.cos(dec0) * math.sin(away) * math.cos(turn))
            ra = ra0 + math.atan2(math.sin(turn) * math.sin(away), math.cos(dec0) * math.cos(away) - math.sin(dec0) * math.sin(away) * math.cos(turn))
            out.write(f"S{i:06d} {math.degrees(ra) % 360.0:.7f} {math.degrees(dec):.7f} {rng.uniform(6.0, 9.0):.2f}\n")
    gsc = folder / "gsc"
    gsc.write_text(CATALOGUE)
    gsc.chmod(0o755)


def start_server(folder, port):
    (folder / "loopback.c").write_text(LOOPBACK)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", folder / "loopback.so", folder / "loopback.c", "-ldl"], check=True)
    environment = {**os.environ, "HOME": str(folder), "LD_PRELOAD": str(folder / "loopback.so"), "PATH": f"{folder}:{os.environ['PATH']}"}
    server = subprocess.Popen(["indiserver", "-p", str(port), "-r", "0", "indi_simulator_telescope", "indi_simulator_ccd"], env=environment,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    for _ in range(200):
        try:
            socket.create_connection(("127.0.0.1", port), 0.5).close()
            return server
        except OSError:
            time.sleep(0.1)
    server.kill()
    raise RuntimeError("indiserver does not answer")


def set_up(port):
    """200 mm in front of the camera; the mount tracks."""
    def put(what, tries=40):
        for _ in range(tries):
            if subprocess.run(["indi_setprop", "-p", str(port), what], capture_output=True).returncode == 0: return
            time.sleep(0.25)
        raise RuntimeError(f"INDI does not take {what}")

    telescope, camera = "Telescope Simulator", "CCD Simulator"
    for device in (telescope, camera):
        put(f"{device}.CONNECTION.CONNECT=On")
    time.sleep(1.0)
    put(f"{telescope}.TELESCOPE_INFO.TELESCOPE_FOCAL_LENGTH;TELESCOPE_APERTURE;GUIDER_FOCAL_LENGTH;GUIDER_APERTURE=200;60;200;60")
    put(f"{telescope}.TELESCOPE_PARK.UNPARK=On")
    put(f"{telescope}.TELESCOPE_TRACK_STATE.TRACK_ON=On")
    put(f"{telescope}.ON_COORD_SET.TRACK=On")
    put(f"{telescope}.EQUATORIAL_EOD_COORD.RA;DEC={CENTRE_DEG[0] / 15.0};{CENTRE_DEG[1]}")
    for _ in range(120):
        state = subprocess.run(["indi_getprop", "-p", str(port), "-1", f"{telescope}.EQUATORIAL_EOD_COORD._STATE"], capture_output=True, text=True)
        if state.stdout.strip() == "Ok": break
        time.sleep(0.5)
    time.sleep(1.0)


def one_run(alidade, seed, words):
    with tempfile.TemporaryDirectory() as name:
        folder, port = pathlib.Path(name), free_port()
        write_sky(folder, seed)
        server = start_server(folder, port)
        try:
            set_up(port)
            url = f"indi://127.0.0.1:{port}/"
            run = subprocess.run([alidade, "head", url + "Telescope Simulator", "--stream", url + "CCD Simulator?seconds=1", "--calibrate", "--move", "--pan-range", "85,95",
                                  "--tilt-range", "17,23", *words, "--out", "out"], cwd=folder, capture_output=True, text=True, timeout=240)
            if run.returncode != 0: raise RuntimeError(f"exit code {run.returncode}: {run.stderr.strip()[-400:]}")
            document = json.loads((folder / "out" / "result.json").read_text())
            again = subprocess.run([alidade, *document["estimate"]["offline"], "--out", "again", "--quiet"], cwd=folder / "out", capture_output=True, text=True)
            offline = json.loads((folder / "out" / "again" / "result.json").read_text())["estimate"]["camera"]["fy"]
        finally:
            server.terminate()
            server.wait()
    assert again.returncode in (0, 6), again.stderr
    return document, offline


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("alidade")
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--until", default="1%")
    args = parser.parse_args()
    for program in ("indiserver", "indi_simulator_telescope", "indi_simulator_ccd", "indi_setprop"):
        if shutil.which(program) is None:
            print(f"skipped: {program} is not installed: indi-bin")
            return 77
    failed = 0
    for seed in range(1, args.runs + 1):
        document, offline = one_run(str(pathlib.Path(args.alidade).resolve()), seed, ["--until", args.until] if args.until else [])
        focal, sigma = document["estimate"]["camera"]["fy"], document["stddev"]["camera"]["fy"]
        holds = abs(focal - TRUTH_PX) < 3.0 * math.hypot(sigma, ABERRATION * TRUTH_PX) and SIGMA_PX[0] < sigma < SIGMA_PX[1] and offline == focal
        failed += not holds
        print(f"seed {seed}: f {focal:.2f} px, truth {TRUTH_PX:.2f} px, sigma {sigma:.2f} px ({(focal - TRUTH_PX) / sigma:+.2f} sigma), by the pixels "
              f"{document['stddev_model']['camera']['fy']:.2f} px, off line {'the same' if offline == focal else offline}: {document['verdict']['sentence']}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
