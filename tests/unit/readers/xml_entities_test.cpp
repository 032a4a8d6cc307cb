#include <chrono>

#include "expect_scene_error.h"
#include "readers/mitsuba_xml.h"

namespace etendue {
namespace {

/// The text of an entity may have lines, which the places where it stands have not.
TEST(XmlEntities, LeaveTheLinesOfTheFile) {
    for (const std::string end : {"\n", "\r\n", "\r"}) {
        const std::string text = "<!DOCTYPE scene [<!ENTITY a \"<string name='x'" + end +
                                 "value='y'/>\">]>" + end + "<scene version=\"3.0.0\">" + end +
                                 "<shape type=\"s\">&a;" + end +
                                 "<float name=\"f\" value=\"b\"/></shape></scene>";
        expect_scene_error(5, "expected a number, found \"b\"",
                           [&] { parse_mitsuba_xml(text, "s.xml"); });
    }
}

TEST(XmlEntities, AreReplacedInLinearTime) {
    const std::string text = "<!DOCTYPE scene [<!ENTITY a \"b\">]><scene version=\"3.0.0\">"
                             "<shape type=\"s\"><string name=\"x\" value=\"" +
                             std::string(500'000, '&') + "\"/></shape></scene>";
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_NO_THROW(parse_mitsuba_xml(text, "s.xml"));
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
}

}  // namespace
}  // namespace etendue
