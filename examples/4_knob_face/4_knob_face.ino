// A knob at A0 opens the jaw, sixty times a second; the lamp shows how far omote's face smiles.
//
// In a stage:
//   [[links]]
//   kind = "binary"
//   port = "/dev/ttyACM0"
//   send = "/dev/ttyACM0"     # the same board shows the face; leave this out where none does

#include "omote_frame.h"

float values[OMOTE_PARAMETERS];
uint8_t given[OMOTE_PARAMETERS], frame[OMOTE_LONGEST];
uint16_t sequence = 0;
unsigned long due = 0;
omote_receiver receiver = {};

void setup() {
  Serial.begin(115200);
  pinMode(LED_BUILTIN, OUTPUT);
  given[OMOTE_JAW_OPEN] = 1;
}

void loop() {
  while (Serial.available())
    if (omote_read(&receiver, Serial.read()))
      analogWrite(LED_BUILTIN, (int)(255 * receiver.values[OMOTE_MOUTH_SMILE_LEFT]));
  if (millis() - due < 17) return;
  due = millis();
  values[OMOTE_JAW_OPEN] = analogRead(A0) / 1023.0f;
  Serial.write(frame, omote_write(values, given, sequence++, due, frame));
}
