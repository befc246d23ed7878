// EXPECT_THROW that also reads the message: a type says what a program does next, its text what a person
// does.
#pragma once

#include <gtest/gtest.h>

#include <exception>
#include <string>

/// what() of the `Error` that `action` throws.
template <class Error>
std::string what_of(const auto& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing thrown";
}

/// The statement behind the text throws std::invalid_argument with exactly this text.
#define EXPECT_REFUSAL(text, ...) EXPECT_EQ(what_of<std::invalid_argument>([&] { __VA_ARGS__; }), text)

/// `statement` throws `Type`, and `part` stands in its what(), which is one line.
#define EXPECT_ERROR(statement, Type, part)                        \
  EXPECT_THROW(                                                    \
      {                                                            \
        try {                                                      \
          statement;                                               \
        } catch (const std::exception& error_) {                   \
          const std::string what_ = error_.what();                 \
          EXPECT_NE(what_.find(part), std::string::npos) << what_; \
          EXPECT_EQ(what_.find('\n'), std::string::npos) << what_; \
          throw;                                                   \
        }                                                          \
      },                                                           \
      Type)
