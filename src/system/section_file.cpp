#include "system/section_file.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "system/section_mark.h"

namespace etendue {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr uint32_t kVersion = 7;
constexpr size_t kMostSections = 64, kBuffer = 1 << 16;

struct FileHeader {
    char mark[kSectionMark.size()];
    uint32_t version, zero;
};

struct SectionHeader {
    char name[32];
    uint64_t size, hash;
};

}  // namespace

SectionWriter::SectionWriter(const std::string& file) {
    file_.emplace(file);
    write_file_header();
}

SectionWriter::SectionWriter() {
    write_file_header();
}

void SectionWriter::write_file_header() {
    FileHeader header{{}, kVersion, 0};
    kSectionMark.copy(header.mark, sizeof header.mark);
    write(&header, sizeof header);
}

void SectionWriter::write(const void* data, size_t size) {
    if (file_ && size >= kBuffer) {
        flush();
        file_->write(data, size);
        return;
    }
    buffer_.append(static_cast<const char*>(data), size);
    if (buffer_.size() >= kBuffer) flush();
}

void SectionWriter::flush() {
    if (!file_) return;
    file_->write(buffer_);
    buffer_.clear();
}

void SectionWriter::begin(std::string_view name) {
    if (name.empty() || name.size() >= sizeof SectionHeader::name)
        throw std::logic_error("wrong name of a section");
    finish();
    name_ = name;
    size_ = 0;
    begin_ = position();
    hash_ = ContentHash();
    hash_.add(name_);
    const SectionHeader unknown{};
    write(&unknown, sizeof unknown);
}

void SectionWriter::put_bytes(const void* data, size_t size) {
    hash_.add_piece({static_cast<const char*>(data), size});
    size_ += size;
    write(data, size);
}

void SectionWriter::finish() {
    if (name_.empty()) return;
    SectionHeader header{{}, size_, hash_.add(size_).value()};
    std::copy(name_.begin(), name_.end(), header.name);
    if (!file_) {
        std::memcpy(&buffer_[begin_], &header, sizeof header);
        return;
    }
    flush();
    const uint64_t end = file_->position();
    file_->seek(begin_);
    file_->write(&header, sizeof header);
    file_->seek(end);
}

void SectionWriter::commit() {
    begin("end");
    finish();
    file_->commit();
}

std::string SectionWriter::take() {
    begin("end");
    finish();
    return std::move(buffer_);
}

SectionReader::SectionReader(const std::string& file)
    : name_(file), is_file_(true), in_(std::make_unique<std::ifstream>(file, std::ios::binary)) {
    if (!*in_)
        throw std::runtime_error(
            fmt::format("cannot read \"{}\": {}", file, std::generic_category().message(errno)));
    read_table();
}

SectionReader::SectionReader(std::string bytes, std::string name)
    : name_(std::move(name)), is_file_(false),
      in_(std::make_unique<std::istringstream>(std::move(bytes))) {
    read_table();
}

SectionReader::~SectionReader() = default;
SectionReader::SectionReader(SectionReader&&) noexcept = default;
SectionReader& SectionReader::operator=(SectionReader&&) noexcept = default;

bool SectionReader::is_one(const std::string& file) {
    char mark[kSectionMark.size()] = {};
    std::ifstream in(file, std::ios::binary);
    return in.read(mark, sizeof mark) && std::string_view(mark, sizeof mark) == kSectionMark;
}

void SectionReader::read_at(uint64_t position, void* data, size_t size) {
    in_->clear();
    in_->seekg(std::streamoff(position));
    in_->read(static_cast<char*>(data), std::streamsize(size));
    if (!*in_) fail("the file cannot be read");
}

void SectionReader::read_table() {
    in_->seekg(0, std::ios::end);
    const std::streamoff end = *in_ ? std::streamoff(in_->tellg()) : -1;
    if (end < 0) fail("the file cannot be read");
    const auto bytes = uint64_t(end);
    FileHeader header;
    if (bytes < sizeof header) fail("this is no state of a rendering");
    read_at(0, &header, sizeof header);
    if (std::string_view(header.mark, sizeof header.mark) != kSectionMark)
        fail("this is no state of a rendering");
    if (header.version != kVersion || header.zero != 0)
        fail(fmt::format("its format has version {}, but this program reads version {}",
                         header.version, kVersion));
    for (uint64_t at = sizeof header;;) {
        SectionHeader section;
        if (bytes - at < sizeof section) fail("the file ends too early");
        read_at(at, &section, sizeof section);
        at += sizeof section;
        const size_t length = ::strnlen(section.name, sizeof section.name);
        const std::string name(section.name, length);
        const bool is_valid =
            length > 0 && length < sizeof section.name &&
            std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < '\x7f'; }) &&
            std::all_of(section.name + length, std::end(section.name),
                        [](char c) { return c == '\0'; });
        if (!is_valid || find(name) || sections_.size() == kMostSections)
            fail(
                fmt::format("the header of a section is damaged, at byte {}", at - sizeof section));
        if (section.size > bytes - at)
            fail(
                fmt::format("the file ends too early: section \"{}\" has {} bytes, but {} are left",
                            name, section.size, bytes - at));
        sections_.push_back({name, at, section.size, section.hash});
        at += section.size;
        if (name != "end") continue;
        verify(sections_.back());
        if (at != bytes) fail(fmt::format("{} bytes follow its end", bytes - at));
        return;
    }
}

const SectionReader::Section* SectionReader::find(std::string_view name) const {
    const auto found = std::find_if(sections_.begin(), sections_.end(),
                                    [&](const Section& s) { return s.name == name; });
    return found != sections_.end() ? &*found : nullptr;
}

uint64_t SectionReader::size(std::string_view section) const {
    const Section* found = find(section);
    return found ? found->size : 0;
}

void SectionReader::close() {
    open_.clear();
    left_ = 0;
    if (is_file_) in_.reset();
}

void SectionReader::open_again() {
    SectionReader again(name_);
    if (again.sections_ != sections_) fail("the file was changed while it was read");
    in_ = std::move(again.in_);
}

void SectionReader::verify(const Section& section) {
    if (!in_) open_again();
    ContentHash hash;
    hash.add(section.name);
    std::vector<char> piece(size_t(std::min<uint64_t>(section.size, 16 * kBuffer)));
    for (uint64_t done = 0; done < section.size;) {
        const size_t size = size_t(std::min<uint64_t>(piece.size(), section.size - done));
        read_at(section.begin + done, piece.data(), size);
        hash.add_piece({piece.data(), size});
        done += size;
    }
    if (hash.add(section.size).value() != section.hash)
        fail(fmt::format("section \"{}\" is damaged: its checksum is wrong", section.name));
}

void SectionReader::open(std::string_view section) {
    const Section* found = find(section);
    open_.clear();
    if (!found) fail(fmt::format("section \"{}\" is missing", section));
    verify(*found);
    open_ = section;
    left_ = found->size;
    in_->clear();
    in_->seekg(std::streamoff(found->begin));
}

void SectionReader::check() {
    for (const Section& s : sections_) verify(s);
}

uint64_t SectionReader::count(size_t element) {
    const auto found = get<uint64_t>();
    if (found > left_ / element)
        fail(fmt::format("a list of {} elements is longer than the section", found));
    return found;
}

void SectionReader::get_bytes(void* data, size_t size) {
    if (size > left_) fail("the section ends too early");
    left_ -= size;
    if (size > 0 && !in_->read(static_cast<char*>(data), std::streamsize(size)))
        fail("the file cannot be read");
}

void SectionReader::get(std::string& text) {
    get_list(text, count(1));
}

void SectionReader::finish() const {
    if (left_ > 0) fail(fmt::format("{} bytes are left over", left_));
}

void SectionReader::fail(const std::string& why) const {
    if (open_.empty()) throw std::runtime_error(fmt::format("{}: {}", name_, why));
    throw std::runtime_error(fmt::format("{}: section \"{}\": {}", name_, open_, why));
}

void SectionReader::fail_count(const char* what, uint64_t found, uint64_t expected) const {
    fail(fmt::format("{} {}, but expected {}", found, what, expected));
}

}  // namespace etendue
