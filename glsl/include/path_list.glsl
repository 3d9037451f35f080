// Which sample's ray a thread has in a step of all paths. Needs the bindings frame, path_list and path_counters.

#ifndef STILLRAY_PATH_LIST
#define STILLRAY_PATH_LIST

uint listed_path(uint step, uint index) {
    uint reflected = path_counters.data[step].reflected;
    uint first = (step & 1u) * frame.data.capacity;
    if (index >= path_counters.data[step].listed) {
        return NO_PATH;
    }
    bool by_kind = (frame.data.flags & (FRAME_PATHS_MIXED | FRAME_PATHS_SPREAD)) == 0u;
    bool behind = by_kind && index >= reflected;
    return path_list.data[first + (behind ? frame.data.capacity - 1u - (index - reflected) : index)];
}

#endif
