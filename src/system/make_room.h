#pragma once

#include <vector>

namespace etendue {

/// Makes room for one more element, so that the next push_back() throws nothing.
template <class T>
void make_room(std::vector<T>& list) {
    if (list.size() == list.capacity()) list.reserve(2 * list.size() + 16);
}

}  // namespace etendue
