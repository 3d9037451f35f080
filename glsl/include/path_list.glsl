// Which sample's ray a thread has in a step of all paths. Needs the bindings frame, path_list and path_counters.

#ifndef STILLRAY_PATH_LIST
#define STILLRAY_PATH_LIST

const uint NO_PATH = 0xffffffffu;

uint listed_path(uint step, uint index) {
    uint reflected = path_counters.data[step].reflected;
    uint refracted = path_counters.data[step].refracted;
    uint first = (step & 1u) * frame.data.capacity;
    if (index >= reflected + refracted) {
        return NO_PATH;
    }
    return path_list.data[first + (index < reflected ? index : frame.data.capacity - 1u - (index - reflected))];
}

#endif
