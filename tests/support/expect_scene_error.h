#pragma once

#include <gtest/gtest.h>

#include <string>

#include "description/scene_description.h"

namespace etendue {

/// `action` must throw a SceneError at this line (0: none) whose message contains `text`.
template <class Action>
void expect_scene_error(int line, const std::string& text, Action&& action) {
    try {
        action();
        ADD_FAILURE() << "no error; expected: " << text;
    } catch (const SceneError& e) {
        EXPECT_EQ(e.where().line, line) << e.what();
        EXPECT_NE(e.message().find(text), std::string::npos) << e.what() << "\nexpected: " << text;
    }
}

}  // namespace etendue
