// The samples of a pixel in the dense list: a run of slots, and with FRAME_FILL a second one that was added behind the list.
// Needs the bindings `frame`, `offsets` and `extras`; the last is read with FRAME_FILL only.

#ifndef STILLRAY_SLOTS
#define STILLRAY_SLOTS

struct Slots {
    uint at;
    uint end;
    uint next;      // the second run
    uint next_end;
};

// Goes on to the second run at the end of the first.
void skip_end(inout Slots slots) {
    if (slots.at == slots.end) {
        slots.at = slots.next;
        slots.end = slots.next_end;
        slots.next = slots.next_end;
    }
}

Slots slots_of(uint index) {
    Slots slots = Slots(offsets.data[index], offsets.data[index + 1u], 0u, 0u);
    if ((frame.data.flags & FRAME_FILL) != 0u) {
        slots.next = extras.data[index];
        slots.next_end = extras.data[index + 1u];
        skip_end(slots);
    }
    return slots;
}

bool has_slot(Slots slots) {
    return slots.at < slots.end;
}

void next_slot(inout Slots slots) {
    ++slots.at;
    skip_end(slots);
}

#endif
