"""The sketches of the pages, compiled for this machine against the small part of Arduino's functions that they use.

The serial port is standard input and output. Pins are read from the file INPUTS, ``"analogue digital"``; what a sketch
does with servos and pins it writes to standard error.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

STUB = r"""
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <poll.h>
#include <time.h>
#include <unistd.h>
enum { A0 = 14, LED_BUILTIN = 13, LOW = 0, HIGH = 1, INPUT_PULLUP = 2, OUTPUT = 1 };
unsigned long millis() { timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return t.tv_sec * 1000 + t.tv_nsec / 1000000; }
struct SerialPort {
  void begin(long) {}
  int available() { pollfd p = {0, POLLIN, 0}; return poll(&p, 1, 1) > 0; }
  int read() { char c; if (::read(0, &c, 1) < 1) exit(0); return (unsigned char)c; }
  void print(const char *s) { if (write(1, s, strlen(s))) {} }
  void print(char c) { if (write(1, &c, 1)) {} }
} Serial;
struct Servo {
  int pin = 0;
  bool attached() { return pin; }
  void attach(int p, int, int) { pin = p; }
  void detach() { if (pin) { fprintf(stderr, "%d off\n", pin); pin = 0; } }
  void writeMicroseconds(int us) { fprintf(stderr, "%d %d\n", pin, us); }
};
int inputs(bool digital) {
  int analogue = 0, level = HIGH;
  FILE *file = fopen(getenv("INPUTS"), "r");
  if (file) { if (fscanf(file, "%d %d", &analogue, &level)) {} fclose(file); }
  return digital ? level : analogue;
}
int analogRead(int) { return inputs(false); }
int digitalRead(int) { return inputs(true); }
void pinMode(int, int) {}
void digitalWrite(int pin, int level) { fprintf(stderr, "pin %d %d\n", pin, level); }
"""


def compile_sketch(page: Path, folder: Path) -> Path:
    """The program of the C++ block of a page; skips the test where there is no compiler."""
    if shutil.which("g++") is None:
        pytest.skip("needs g++ to compile the sketch")
    found = re.findall(r"^```cpp\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert len(found) == 1
    code = found[0].replace("#include <Servo.h>", "")
    (folder / "sketch.cpp").write_text(f"{STUB}{code}int main() {{ setup(); for (;;) loop(); }}\n")
    warnings = ("-Wall", "-Wextra", "-Werror", "-Wno-sign-compare", "-Wno-format-truncation")
    subprocess.run(["g++", "-O1", *warnings, "-o", folder / "sketch", folder / "sketch.cpp"], check=True)
    return folder / "sketch"
