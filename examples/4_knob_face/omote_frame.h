/* omote's binary frame for microcontrollers: write one, read one. Copy this file into a sketch; it needs nothing else.

   The frame is specified in docs/links.md, "Binary". Parameters are in the order of LIST PARAMETERS, for example jawOpen
   is 17, OMOTE_JAW_OPEN. C99 and C++11; no memory is allocated; a receiver takes 0.4 KB. */

#ifndef OMOTE_FRAME_H
#define OMOTE_FRAME_H

#include <stdint.h>
#include <string.h>

enum {
  OMOTE_PARAMETERS = 59,
  OMOTE_VERSION = 1,
  OMOTE_UNIT = 16384,   /* what the value 1 is in a frame */
  OMOTE_FACE = 1,       /* flags */
  OMOTE_TIME = 2,
  OMOTE_LONGEST = 9 + 8 + 2 * OMOTE_PARAMETERS + 2 + 2 /* bytes of a frame on the wire, with the zero at its end */
};

/* Places of the parameters in `values`; Left and Right are the face's own. */
enum {
  OMOTE_EYE_BLINK_LEFT, OMOTE_EYE_LOOK_DOWN_LEFT, OMOTE_EYE_LOOK_IN_LEFT, OMOTE_EYE_LOOK_OUT_LEFT,
  OMOTE_EYE_LOOK_UP_LEFT, OMOTE_EYE_SQUINT_LEFT, OMOTE_EYE_WIDE_LEFT, OMOTE_EYE_BLINK_RIGHT,
  OMOTE_EYE_LOOK_DOWN_RIGHT, OMOTE_EYE_LOOK_IN_RIGHT, OMOTE_EYE_LOOK_OUT_RIGHT, OMOTE_EYE_LOOK_UP_RIGHT,
  OMOTE_EYE_SQUINT_RIGHT, OMOTE_EYE_WIDE_RIGHT, OMOTE_JAW_FORWARD, OMOTE_JAW_LEFT, OMOTE_JAW_RIGHT, OMOTE_JAW_OPEN,
  OMOTE_MOUTH_CLOSE, OMOTE_MOUTH_FUNNEL, OMOTE_MOUTH_PUCKER, OMOTE_MOUTH_LEFT, OMOTE_MOUTH_RIGHT,
  OMOTE_MOUTH_SMILE_LEFT, OMOTE_MOUTH_SMILE_RIGHT, OMOTE_MOUTH_FROWN_LEFT, OMOTE_MOUTH_FROWN_RIGHT,
  OMOTE_MOUTH_DIMPLE_LEFT, OMOTE_MOUTH_DIMPLE_RIGHT, OMOTE_MOUTH_STRETCH_LEFT, OMOTE_MOUTH_STRETCH_RIGHT,
  OMOTE_MOUTH_ROLL_LOWER, OMOTE_MOUTH_ROLL_UPPER, OMOTE_MOUTH_SHRUG_LOWER, OMOTE_MOUTH_SHRUG_UPPER,
  OMOTE_MOUTH_PRESS_LEFT, OMOTE_MOUTH_PRESS_RIGHT, OMOTE_MOUTH_LOWER_DOWN_LEFT, OMOTE_MOUTH_LOWER_DOWN_RIGHT,
  OMOTE_MOUTH_UPPER_UP_LEFT, OMOTE_MOUTH_UPPER_UP_RIGHT, OMOTE_BROW_DOWN_LEFT, OMOTE_BROW_DOWN_RIGHT,
  OMOTE_BROW_INNER_UP, OMOTE_BROW_OUTER_UP_LEFT, OMOTE_BROW_OUTER_UP_RIGHT, OMOTE_CHEEK_PUFF,
  OMOTE_CHEEK_SQUINT_LEFT, OMOTE_CHEEK_SQUINT_RIGHT, OMOTE_NOSE_SNEER_LEFT, OMOTE_NOSE_SNEER_RIGHT, OMOTE_TONGUE_OUT,
  OMOTE_HEAD_YAW, OMOTE_HEAD_PITCH, OMOTE_HEAD_ROLL, OMOTE_LEFT_EYE_YAW, OMOTE_LEFT_EYE_PITCH, OMOTE_RIGHT_EYE_YAW,
  OMOTE_RIGHT_EYE_PITCH
};

/* CRC-16/CCITT-FALSE */
static inline uint16_t omote_crc(const uint8_t *data, uint16_t length) {
  uint16_t crc = 0xFFFF;
  for (uint16_t i = 0; i < length; i++) {
    crc = (uint16_t)(crc ^ ((uint16_t)data[i] << 8));
    for (uint8_t bit = 0; bit < 8; bit++)
      crc = (uint16_t)((crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1);
  }
  return crc;
}

/* COBS: at most 254 bytes, as a whole face has 137; returns the length, with a zero behind it. */
static inline uint16_t omote_stuff(const uint8_t *data, uint16_t length, uint8_t *out) {
  uint16_t code_at = 0, at = 1;
  uint8_t code = 1;
  for (uint16_t i = 0; i < length; i++) {
    if (data[i]) {
      out[at++] = data[i];
      code++;
    } else {
      out[code_at] = code;
      code_at = at++;
      code = 1;
    }
  }
  out[code_at] = code;
  out[at++] = 0;
  return at;
}

static inline int16_t omote_step(float value) {
  float steps = value * OMOTE_UNIT;
  if (steps > 32767.0f) return 32767;
  if (steps < -32767.0f) return -32767;
  return (int16_t)(steps < 0 ? steps - 0.5f : steps + 0.5f);
}

/* Writes a frame to `out`, which has room for OMOTE_LONGEST bytes; returns how many to send.
   values: OMOTE_PARAMETERS numbers. given: which of them count, or NULL for all. */
static inline uint16_t omote_write(const float *values, const uint8_t *given, uint16_t sequence, uint32_t milliseconds,
                                   uint8_t *out) {
  uint8_t body[OMOTE_LONGEST];
  uint16_t at = 9 + (OMOTE_PARAMETERS + 7) / 8;
  memset(body, 0, sizeof body);
  body[0] = OMOTE_VERSION;
  body[1] = (uint8_t)sequence;
  body[2] = (uint8_t)(sequence >> 8);
  for (uint8_t i = 0; i < 4; i++) body[3 + i] = (uint8_t)(milliseconds >> (8 * i));
  body[7] = OMOTE_FACE | OMOTE_TIME;
  body[8] = OMOTE_PARAMETERS;
  for (uint8_t i = 0; i < OMOTE_PARAMETERS; i++) {
    if (given && !given[i]) continue;
    uint16_t step = (uint16_t)omote_step(values[i]);
    body[9 + i / 8] = (uint8_t)(body[9 + i / 8] | 1 << i % 8);
    body[at++] = (uint8_t)step;
    body[at++] = (uint8_t)(step >> 8);
  }
  uint16_t crc = omote_crc(body, at);
  body[at++] = (uint8_t)crc;
  body[at++] = (uint8_t)(crc >> 8);
  return omote_stuff(body, at, out);
}

/* What a receiver keeps. Set it to zero before the first byte: omote_receiver receiver = {0}; */
typedef struct {
  float values[OMOTE_PARAMETERS];  /* the newest values; those that were never given are 0 */
  uint8_t given[OMOTE_PARAMETERS]; /* which the newest frame gave */
  uint8_t face;                    /* whether a face is seen */
  uint16_t sequence;
  uint32_t milliseconds;
  uint16_t refused;                /* frames that were damaged */
  uint8_t buffer[OMOTE_LONGEST];
  uint16_t length;
} omote_receiver;

static inline uint8_t omote_read_frame(omote_receiver *r) {
  uint8_t body[OMOTE_LONGEST];
  uint16_t length = 0, at = 0;
  while (at < r->length) { /* undo COBS */
    uint8_t code = r->buffer[at++];
    if (code == 0 || at + code - 1 > r->length) return 0;
    for (uint8_t i = 1; i < code; i++) body[length++] = r->buffer[at++];
    if (code < 255 && at < r->length) body[length++] = 0;
  }
  if (length < 11) return 0;
  length = (uint16_t)(length - 2);
  if (omote_crc(body, length) != (uint16_t)(body[length] | (uint16_t)body[length + 1] << 8)) return 0;
  uint8_t count = body[8];
  uint16_t bits = 9;
  at = (uint16_t)(9 + (count + 7) / 8);
  if (body[0] != OMOTE_VERSION || at > length) return 0;
  memset(r->given, 0, sizeof r->given);
  for (uint8_t i = 0; i < count; i++) {
    if (!(body[bits + i / 8] >> i % 8 & 1)) continue;
    if (at + 2 > length) return 0;
    if (i < OMOTE_PARAMETERS) {
      r->values[i] = (float)(int16_t)(uint16_t)(body[at] | (uint16_t)body[at + 1] << 8) / OMOTE_UNIT;
      r->given[i] = 1;
    }
    at = (uint16_t)(at + 2);
  }
  r->sequence = (uint16_t)(body[1] | (uint16_t)body[2] << 8);
  r->milliseconds = 0;
  for (uint8_t i = 0; i < 4; i++) r->milliseconds |= (uint32_t)body[3 + i] << (8 * i);
  r->face = body[7] & OMOTE_FACE;
  return 1;
}

/* Takes one byte; returns 1 with the byte that completes a good frame. */
static inline uint8_t omote_read(omote_receiver *r, uint8_t byte) {
  if (byte) {
    if (r->length < OMOTE_LONGEST) r->buffer[r->length] = byte;
    if (r->length <= OMOTE_LONGEST) r->length++;
    return 0;
  }
  uint8_t good = r->length > 0 && r->length <= OMOTE_LONGEST && omote_read_frame(r);
  if (!good && r->length > 0) r->refused++;
  r->length = 0;
  return good;
}

#endif
